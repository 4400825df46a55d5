"""The vehicle's compiled physics: it takes references and wind and gives the true motion."""
