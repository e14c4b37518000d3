"""From rest to full load: recorded steps, increments that are cut back, predictions, recovery."""
