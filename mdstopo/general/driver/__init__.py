"""What Python does with a compiled scene: evaluate it, differentiate, price candidates, tell why a run ended early."""
