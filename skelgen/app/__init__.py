"""The application layer that both front ends share."""
