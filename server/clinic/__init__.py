"""Patients and visits: identity, consent, notes, training programme, sessions, sensors."""
