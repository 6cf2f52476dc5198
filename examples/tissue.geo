// Mesh it: gmsh -3 tissue.geo -o tissue.msh
//
// A piece of soft tissue of the shape of a liver, about 80 x 50 x 30 mm: two lobes grown together on a flat base.
// Lengths in mm. The base is clamped, a patch of 12 mm on the back of the small lobe is grasped.

SetFactory("OpenCASCADE");

// The large lobe: 54 x 50 x 60 mm, its lower half below the base.
Sphere(1) = {0, 0, 0, 1};
Dilate { {0, 0, 0}, {27, 25, 30} } { Volume{1}; }

// The small lobe: 60 x 32 x 38 mm, aslant.
Sphere(2) = {0, 0, 0, 1};
Dilate { {0, 0, 0}, {30, 16, 19} } { Volume{2}; }
Rotate { {0, 0, 1}, {0, 0, 0}, -Pi / 9 } { Volume{2}; }
Translate { 25, -5, 0 } { Volume{2}; }

BooleanUnion(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };

Box(4) = {-50, -50, 0, 150, 100, 50};
BooleanIntersection(5) = { Volume{3}; Delete; }{ Volume{4}; Delete; };

// The grasper's jaws leave their outline on the surface: what they hold is a volume of its own.
Sphere(6) = {40.5, -3, 14.5, 6};
Rotate { {0, 1, 0}, {40.5, -3, 14.5}, -Pi / 2 } { Volume{6}; }
BooleanIntersection(7) = { Volume{5}; }{ Volume{6}; Delete; };
tissue() = BooleanFragments{ Volume{5}; Delete; }{ Volume{7}; Delete; };
// Grasped is the skin but for what bounds the rest of the tissue, its first part.
skin() = Abs(CombinedBoundary{ Volume{tissue()}; });
around() = Abs(Boundary{ Volume{tissue(0)}; });
grasped() = skin();
grasped() -= around();
base() = Surface In BoundingBox{-100, -100, -1, 100, 100, 1};

Physical Volume("tissue") = tissue();
Physical Surface("clamped") = base();
Physical Surface("grasped") = grasped();

Mesh.MeshSizeMin = 4.2;
Mesh.MeshSizeMax = 4.2;
Mesh.Algorithm = 6;
Mesh.Algorithm3D = 1;
Mesh.Optimize = 1;
Mesh.OptimizeNetgen = 1;
Mesh.MshFileVersion = 4.1;
Mesh.Binary = 0;
