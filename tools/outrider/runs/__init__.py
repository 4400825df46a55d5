"""Files of a run directory: a finished flight is written as logs, arrays and a summary, and read back."""
