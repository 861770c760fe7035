"""The 3D view: a viser scene per open project, drawn from the project model and never the owner of anything."""
