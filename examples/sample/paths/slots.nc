%
(Two slots in a plate, millimetres from its corner)
G21 G90 G17
G0 X0 Y-150 Z60
G1 Z0 F600
G1 Y150
G0 Z60
G0 X80 Y150
G1 Z0
X80 Y50
X120 Y-150
G0 Z60
M30
%
