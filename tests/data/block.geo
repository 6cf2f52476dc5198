// A block of 30 x 20 x 10 mm in two halves, one of them in a group without a name; lengths in mm.
// gmsh -3 block.geo -o block.msh
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 15, 20, 10};
Box(2) = {15, 0, 0, 15, 20, 10};
Coherence;
base() = Surface In BoundingBox{-1, -1, -1, 31, 21, 1};
tip() = Surface In BoundingBox{29, -1, -1, 31, 21, 11};
Physical Surface("clamped", 7) = base();
Physical Surface("pulled") = tip();
Physical Volume("soft", 11) = {1};
Physical Volume("tissue", 12) = {1, 2};
Physical Volume(13) = {2};
Mesh.MeshSizeMin = 7;
Mesh.MeshSizeMax = 7;
