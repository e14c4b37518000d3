"""What happens to a body: where, what holds it there, what loads it, stage by stage."""
