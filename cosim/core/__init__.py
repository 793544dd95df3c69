"""The loop in C: filter, controller and the plant's calls, compiled once for each structure of what a loop knows."""
