"""Files of a run directory: takes a finished flight, gives its logs, arrays, summary and figures, and reads them."""
