"""Results as files: curves, summary, VTU series, STL, figures and one HTML page."""
