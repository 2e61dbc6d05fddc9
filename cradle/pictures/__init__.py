"""Figures and moving pictures; matplotlib is imported here and nowhere else."""
