"""HTTP, 3D view, store, jobs, report and command line, all thin over `app.workflow`."""
