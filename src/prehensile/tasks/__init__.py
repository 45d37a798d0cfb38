"""Complete behaviours, one module each."""
