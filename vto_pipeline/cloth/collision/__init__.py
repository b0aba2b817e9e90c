"""Contacts with bodies and shapes. Knows no solver."""
