"""Things that tests are made of: projects, logs, recordings, results. No file here is a test."""
