"""VTK data: arrays, attachments, moving bones, provenance."""
