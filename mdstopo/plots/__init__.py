"""Pictures of results (extra `plot`); nothing else imports matplotlib."""
