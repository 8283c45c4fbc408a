"""What LighTNet is compared with: the paper's baselines, reformulated as it says, and three that are not trained."""
