"""Files of one indentation: contact forces, fields in the cover, and curves of load over depth."""
