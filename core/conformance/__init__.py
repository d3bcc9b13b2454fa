"""What any plugin of a kind must satisfy, as plain functions that anybody can run against a plugin of their own."""
