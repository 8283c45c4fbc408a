"""What LighTNet is compared with: the paper's rivals, reformulated as it says, and three that learn nothing."""
