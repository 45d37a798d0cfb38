// analytic_ik
