"""What Elastune is compared with."""
