"""The figures and tables of Caillette, Galata & Howard 2007, run again."""
