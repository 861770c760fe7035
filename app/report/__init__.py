"""The report: one self-contained HTML file, figures as inline SVG, prints on A4."""
