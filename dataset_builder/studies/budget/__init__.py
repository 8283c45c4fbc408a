"""The study of a render budget: many examples with noise or few without, denoised or raw, samples for which layers."""
