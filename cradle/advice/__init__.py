"""Which model a scene needs: from what is known and what is wanted, by what was measured."""
