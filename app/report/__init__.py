"""Reports of alignments and assessments: one `Document` each, shown as HTML, PDF, JSON and CSV."""
