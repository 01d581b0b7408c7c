"""What everything else rests on: errors, files, memory, threads, where a figure comes from."""
