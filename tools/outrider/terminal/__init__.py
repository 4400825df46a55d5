"""Terminal output: takes lines and shares of progress, writes them to standard error."""
