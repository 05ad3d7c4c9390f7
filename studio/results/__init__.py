"""What is made of runs: views, measures, comparisons, files for other programs; and footage drawn with exact truth."""
