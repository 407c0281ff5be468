"""The methods of integration: their steps, and these linearised, forwards and backwards."""
