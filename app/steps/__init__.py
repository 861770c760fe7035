"""The steps behind `app.workflow`, one module each."""
