"""Can the vehicle cross? A verdict on one run, and maps of many runs."""
