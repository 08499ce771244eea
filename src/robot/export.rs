//! The classical 36×36 form: stiffness and mass in centre-of-mass coordinates of the links.
