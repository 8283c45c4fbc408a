"""Networks with their losses and checkpoints: everything that turns a batch into a prediction."""
