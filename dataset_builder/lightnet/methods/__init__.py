"""Networks with their losses and checkpoints: whatever turns a batch into a prediction."""
