"""State estimation: it takes the true motion and gives an estimate with errors of sensors and GPS."""
