"""Resources of processes: gives the number of cores."""
