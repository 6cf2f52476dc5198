// A plate of 40 x 20 mm with a round hole of 10 mm; lengths in mm.
// gmsh -2 plate.geo -o plate.msh; -setnumber quads 1 makes quadrilaterals.
DefineConstant[ quads = 0 ];
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 40, 20};
Disk(2) = {20, 10, 0, 5};
plate() = BooleanDifference{ Surface{1}; Delete; }{ Surface{2}; Delete; };
left() = Curve In BoundingBox{-1, -1, -1, 1, 21, 1};
right() = Curve In BoundingBox{39, -1, -1, 41, 21, 1};
Physical Curve("clamped") = left();
Physical Curve("pulled") = right();
Physical Surface("tissue") = plate();
Mesh.MeshSizeMin = 4;
Mesh.MeshSizeMax = 4;
If (quads)
  Mesh.Algorithm = 8;
  Mesh.RecombineAll = 1;
  Mesh.RecombinationAlgorithm = 3;
EndIf
