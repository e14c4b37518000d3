"""From rest to full load."""
