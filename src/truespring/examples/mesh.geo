// A lobe of soft tissue with a tumour; mesh it with gmsh: gmsh -3 mesh.geo -o mesh.msh
// Half an ellipsoid of 60 x 44 x 25 mm on a flat base; the tumour is a ball of 12 mm inside. Lengths in mm.
SetFactory("OpenCASCADE");

Sphere(1) = {0, 0, 0, 1};
Dilate { {0, 0, 0}, {30, 22, 25} } { Volume{1}; }
Box(2) = {-40, -40, 0, 80, 80, 40};
BooleanIntersection(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };

// What the grasper holds is a volume of its own, so that its outline is in the mesh.
Sphere(4) = {15, 0, 23, 6};
BooleanIntersection(5) = { Volume{3}; }{ Volume{4}; Delete; };
Sphere(6) = {13, 0, 10, 6};
parts() = BooleanFragments{ Volume{3}; Delete; }{ Volume{5, 6}; Delete; };

// Fragments share their faces: part 0 is held, part 1 the tumour, part 2 the rest.
tumour() = {parts(1)};
tissue() = {parts(0), parts(2)};
others() = {parts(1), parts(2)};

// The grasped skin bounds no other part.
skin() = Abs(CombinedBoundary{ Volume{parts()}; });
around() = Abs(CombinedBoundary{ Volume{others()}; });
grasped() = skin();
grasped() -= around();
base() = Surface In BoundingBox{-100, -100, -1, 100, 100, 1};

Physical Volume("tissue") = tissue();
Physical Volume("tumour") = tumour();
Physical Surface("base") = base();
Physical Surface("grasped") = grasped();

Mesh.MeshSizeMin = 6;
Mesh.MeshSizeMax = 6;
Mesh.Optimize = 1;
Mesh.MshFileVersion = 2.2;
Mesh.Binary = 0;
