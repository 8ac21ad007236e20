"""Fit the scenes to recordings, and carry shards to other machines and back: for who maintains the evidence."""
