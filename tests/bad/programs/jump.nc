G90 G0 X0 Y0 Z0 A20 C0
o1 while [#1 LT 5]
G1 X5 F10
o1 endwhile
