"""Can the vehicle cross? The verdict on one run, and maps over many."""
