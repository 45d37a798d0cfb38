// differential_ik
