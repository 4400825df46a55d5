"""Reader of YAML files: takes bytes, gives typed and checked models, or one line for each fault."""
