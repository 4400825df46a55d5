"""Command line of outrider: takes configuration, logs and links; gives flights, runs and reports."""
