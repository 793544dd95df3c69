"""The loop around the gyroscope FMU: observers, controller, angle units, master."""
