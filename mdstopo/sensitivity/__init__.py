"""Springs between free bodies: gradients by the adjoint method, prices of candidates; and passes over candidates."""
