// How long a person stands still before walking, in s: what the server asks for (core/online/calibrating.py).
export const STAND_S = 3;
