"""Laws of structural acoustics: contacts, plates, layers, rooms. Nothing here knows of robots."""
