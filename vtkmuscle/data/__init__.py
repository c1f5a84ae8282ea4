"""VTK data without filters: arrays, attachments, moving bones, provenance."""
