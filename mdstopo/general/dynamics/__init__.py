"""Forces of members, contacts and loads, equations of motion with joints, and the way back onto the joints."""
