// kinematic_tree
