// Half of a pin in the hole of a plate; pin and hole have the radius R, the load acts in the bore.
SetFactory("Built-in");
R = 10; bore = 0.5; W = 200;
fine = 0.35; coarse = 40;
// plate
Point(1) = {0, 0, 0, fine};
Point(2) = {0, -R, 0, fine};  Point(3) = {R, 0, 0, 2*fine};  Point(4) = {0, R, 0, 6*fine};
Point(5) = {0, -W, 0, coarse}; Point(6) = {W, -W, 0, coarse};
Point(7) = {W, W, 0, coarse};  Point(8) = {0, W, 0, coarse};
Circle(1) = {2, 1, 3}; Circle(2) = {3, 1, 4};
Line(3) = {4, 8}; Line(4) = {8, 7}; Line(5) = {7, 6}; Line(6) = {6, 5}; Line(7) = {5, 2};
Curve Loop(1) = {1, 2, 3, 4, 5, 6, 7}; Plane Surface(1) = {1};
// pin
Point(12) = {0, -R, 0, fine}; Point(13) = {R, 0, 0, 2*fine}; Point(14) = {0, R, 0, 6*fine};
Point(15) = {0, -bore, 0, bore/2}; Point(16) = {bore, 0, 0, bore/2}; Point(17) = {0, bore, 0, bore/2};
Circle(11) = {12, 1, 13}; Circle(12) = {13, 1, 14};
Line(13) = {14, 17}; Circle(14) = {17, 1, 16}; Circle(15) = {16, 1, 15}; Line(16) = {15, 12};
Curve Loop(2) = {11, 12, 13, 14, 15, 16}; Plane Surface(2) = {2};
Physical Surface("plate") = {1}; Physical Surface("pin") = {2};
Physical Curve("hole") = {1, 2}; Physical Curve("middle") = {3, 7, 13, 16};
Physical Curve("outside") = {4, 5, 6}; Physical Curve("rim") = {11, 12}; Physical Curve("bore") = {14, 15};
Mesh.ElementOrder = 2;
Mesh.MshFileVersion = 4.1;
