"""What a study leaves behind: curves, summary, VTU series, STL, figures and one HTML page."""
