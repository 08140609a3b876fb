"""Patients and their visits: identity, consent, notes, programme, sessions, sensors."""
