"""The command line and the report of gyrotwin, on top of everything else."""
