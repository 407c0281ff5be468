"""What Python does with a compiled scene: evaluate, refine peaks, differentiate, settle, price, say who is to blame."""
