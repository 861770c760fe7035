"""Legal programs as other people write them: other styles, other words, other generations. Text of this project."""

# ruff: noqa: E501 (KRL text stays in one piece)

_INI = """;FOLD INI;%{PE}
  ;FOLD BASISTECH INI
    GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )
    INTERRUPT ON 3
    BAS (#INITMOV,0 )
  ;ENDFOLD (BASISTECH INI)
  ;FOLD USER INI
    ;Make your modifications here
  ;ENDFOLD (USER INI)
;ENDFOLD (INI)
"""

POSITIVE: dict[str, dict[str, str]] = {
    "lower-case-of-the-nineties": {
        "weld7.src": "&access rv\n&rel 12\ndef weld7 ( )\nbas (#initmov,0 )\n$base=base_data[2]\n$tool=tool_data[1]\nptp xhome\n"
        "$vel.cp=0.3\nlin {x 500.5,y 0,z 812.25,a -90,b 0,c 180} c_dis\nlin {x 500.5,y 40,z 812.25,a -90,b 0,c 180}\nptp xhome\nend\n",
    },
    "inline-form-classic": {
        "GRIP.src": "&ACCESS RVP\n&REL 4\n&COMMENT gripper test\nDEF GRIP ( )\n" + _INI
        + ";FOLD PTP HOME  Vel= 100 % DEFAULT;%{PE}%R 5.5.32,%MKUKATPBASIS,%CMOVE,%VPTP,%P 1:PTP, 2:HOME, 3:, 5:100, 7:DEFAULT\n"
        "$BWDSTART = FALSE\nPDAT_ACT=PDEFAULT\nFDAT_ACT=FHOME\nBAS (#PTP_PARAMS,100 )\n$H_POS=XHOME\nPTP XHOME\n;ENDFOLD\n"
        ";FOLD LIN P1 CONT Vel= 0.25 m/s CPDAT1 Tool[1]:probe Base[1]:table\n$BWDSTART = FALSE\nLDAT_ACT=LCPDAT1\nFDAT_ACT=FP1\n"
        "BAS (#CP_PARAMS,0.25)\nLIN XP1 C_DIS\n;ENDFOLD\nEND\n",
        "GRIP.dat": "DEFDAT  GRIP\n;FOLD EXTERNAL DECLARATIONS;%{PE}%MKUKATPBASIS,%CEXT,%VCOMMON,%P\nEXT  BAS (BAS_COMMAND  :IN,REAL  :IN )\n"
        "DECL INT SUCCESS\n;ENDFOLD (EXTERNAL DECLARATIONS)\nDECL E6POS XP1={X 701.5,Y -20.25,Z 333.0,A 90.0,B 0.5,C 179.5,S 2,T 35,E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}\n"
        'DECL FDAT FP1={TOOL_NO 1,BASE_NO 1,IPO_FRAME #BASE,POINT2[] " ",TQ_STATE FALSE}\n'
        "DECL LDAT LCPDAT1={VEL 2.0,ACC 100.0,APO_DIST 50.0,APO_FAC 50.0,ORI_TYP #VAR}\nENDDAT\n",
    },
    "inline-form-spline-family": {
        "PAINT.src": "DEF PAINT ( )\n" + _INI
        + ";FOLD SPTP HOME Vel=100 % DEFAULT ;%{PE}\n;FOLD Parameters ;%{h}\n;Params IlfProvider=kukaroboter.basistech.inlineforms.movement.spline; Kuka.PointName=HOME\n;ENDFOLD\n"
        "SPTP XHOME WITH $VEL_AXIS[1] = SVEL_JOINT(100.0), $TOOL = STOOL2(FHOME), $BASE = SBASE(FHOME.BASE_NO)\n;ENDFOLD\n"
        "SLIN XP1 WITH $VEL = SVEL_CP(0.4, , LCPDAT1), $TOOL = STOOL2(FP1), $BASE = SBASE(FP1.BASE_NO), $IPO_MODE = SIPO_MODE(FP1.IPO_FRAME) C_SPL\n"
        "SLIN {X 10.0,Y 20.0,Z 30.0,A 0.0,B 0.0,C 0.0}\nEND\n",
    },
    "functions-and-locals": {
        "MATHS.src": "DEF MATHS ( )\nDECL REAL L\nDECL FRAME F\nINT I\nL = 0.0\nFOR I = 1 TO 10 STEP 2\nL = L + HALVED (I * 2.5)\nENDFOR\n"
        "F = {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nF.X = L\nSHIFT (F, 3.5)\nEND\n\nDEFFCT REAL HALVED (V :IN)\nREAL V\nRETURN (V / 2.0)\nENDFCT\n\n"
        "DEF SHIFT (Q :OUT, BY :IN)\nDECL FRAME Q\nREAL BY\nQ.Z = Q.Z - BY\nEND\n",
    },
    "state-machine": {
        "CELL1.src": "DEF CELL1 ( )\nDECL INT WANTED\n" + _INI + "PTP XHOME\nLOOP\nP00 (#EXT_PGNO,#PGNO_GET,DMY[],0 )\nSWITCH PGNO\nCASE 1\n"
        "P00 (#EXT_PGNO,#PGNO_ACKN,DMY[],0 )\nPARTA ( )\nCASE 2, 3, 4\nPARTB (PGNO)\nDEFAULT\nP00 (#EXT_PGNO,#PGNO_FAULT,DMY[],0 )\nENDSWITCH\nENDLOOP\nEND\n",
        "PARTA.src": "DEF PARTA ( )\nWAIT FOR $IN[12] AND NOT $IN[13]\nPULSE ($OUT[4],TRUE,0.25)\nEND\n",
        "PARTB.src": "DEF PARTB (KIND :IN)\nINT KIND\nIF (KIND == 2) OR (KIND == 3) THEN\n$OUT[KIND] = TRUE\nELSE\nHALT\nENDIF\nEND\n",
    },
    "spline-of-all-segments": {
        "CURVE.src": "DEF CURVE ( )\nBAS (#INITMOV,0 )\n$BASE = {X 1000.0,Y 0.0,Z 500.0,A 0.0,B 0.0,C 0.0}\nSPTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}\n"
        "SPLINE WITH $VEL.CP = 0.6, $ACC.CP = 2.0\nTIME_BLOCK START\nSPL {X 0,Y 0,Z 0,A 0,B 0,C 0}\nTIME_BLOCK PART = 20\nSLIN {X 50,Y 0,Z 0,A 0,B 0,C 0}\n"
        "TIME_BLOCK PART = 80\nTIME_BLOCK END = 4.5\nCONST_VEL START = 10 ONSTART\nSCIRC {X 75,Y 25,Z 0,A 0,B 0,C 0},{X 100,Y 0,Z 0,A 0,B 0,C 0},CA 90.0\n"
        "TRIGGER WHEN PATH = -12.5 ONSTART DELAY = 20 DO $OUT[7] = TRUE\nSPL {X 130,Y 0,Z 0,A 0,B 0,C 0}\nCONST_VEL END = -5\nENDSPLINE C_SPL\nEND\n",
    },
    "bits-and-status": {
        "PICK.src": "DEF PICK ( )\nBAS (#INITMOV,0 )\nBAS (#BASE,4)\nBAS (#TOOL,2)\nPTP {POS: X 800.0,Y 10.0,Z 600.0,A 0.0,B 90.0,C 0.0,S 'B010',T 'B100011'} C_PTP\n"
        "LIN {X 820.0,Y 10.0,Z 600.0} C_VEL\nLIN {Z 550.0}\nLIN_REL {X 10.0,Z -5.0} C_DIS\nPTP_REL {A1 -5.0}\nEND\n",
    },
    "exponents-of-a-backup": {
        "FRAMES.dat": "DEFDAT FRAMES PUBLIC\nDECL GLOBAL FRAME TABLEBASE={X 924.139893,Y 1099.00952,Z 527.83374,A -89.7931595,B 2.38999218E-01,C 1.51745229E-12}\n"
        "DECL GLOBAL REAL RADII[3]\nRADII[1]=12.5\nRADII[2]=.5\nRADII[3]=-1.0E+02\nDECL GLOBAL CHAR MESSAGE[24]\nMESSAGE[]=\"part present; go on\"\nENDDAT\n",
    },
    "base-moved-by-the-operator": {
        "SHIFTED.src": "DEF SHIFTED ( )\nBAS (#INITMOV,0 )\nPTP XHOME\nBASE_DATA[7] = BASE_DATA[6] : {X 1.25,Y 0.0,Z -0.5,A 0.1,B 0.0,C 0.0}\n$BASE = BASE_DATA[7] : {X 0.0,Y 0.0,Z 2.0,A 0.0,B 0.0,C 0.0}\n"
        "$TOOL = TOOL_DATA[3]\nLIN {X 0.0,Y 0.0,Z 50.0,A 0.0,B 0.0,C 180.0}\nLIN {X 0.0,Y 0.0,Z 10.0,A 0.0,B 0.0,C 180.0}\nEND\n",
    },
    "structures-and-enums": {
        "TYPES.dat": "DEFDAT TYPES PUBLIC\nGLOBAL ENUM COLOUR RED, GREEN, BLUE\nGLOBAL STRUC SPOT REAL SIZE, INT COUNT, COLOUR TINT\nDECL GLOBAL SPOT FIRST={SIZE 2.5,COUNT 4,TINT #GREEN}\nENDDAT\n",
        "USE.src": "DEF USE ( )\nDECL SPOT MINE\nMINE = FIRST\nMINE.COUNT = MINE.COUNT + 1\nIF MINE.TINT == #GREEN THEN\nMINE.SIZE = 1.0\nENDIF\nEND\n",
    },
    "interrupt-search": {
        "SEEK.src": "DEF SEEK ( )\nBAS (#INITMOV,0 )\n$BASE = $WORLD\nPTP XHOME\nINTERRUPT DECL 21 WHEN $IN[5] == TRUE DO FOUND ( )\nINTERRUPT ON 21\nDOWN ( )\nINTERRUPT OFF 21\nEND\n"
        "DEF DOWN ( )\nLIN_REL {Z -100.0}\nWAIT SEC 0.0\nEND\nDEF FOUND ( )\nBRAKE\nRESUME\nEND\n",
    },
    "jumps-and-repeats": {
        "AGAIN.src": "DEF AGAIN ( )\nDECL INT N\nN = 0\nTRY:\nREPEAT\nN = N + 1\nIF N > 5 THEN\nGOTO DONE\nENDIF\nUNTIL $IN[3]\nWHILE NOT $IN[4]\nWAIT SEC 0.012 ; one cycle\nENDWHILE\nGOTO TRY\nDONE:\nEND\n",
    },
    "signals-and-analogue": {
        "GLUE.src": "DEF GLUE ( )\nSIGNAL VALVE $OUT[17]\nSIGNAL LEVEL $IN[1] TO $IN[8]\nDECL REAL U\nANIN ON U = 1.0 * $ANIN[2] + 0.0\nVALVE = TRUE\nIF LEVEL > 200 THEN\nVALVE = FALSE\nENDIF\nANIN OFF U\nEND\n",
    },
    "triggers-with-calls": {
        "MARKS.src": "DEF MARKS ( )\nBAS (#INITMOV,0 )\nBAS (#BASE,1)\nPTP XHOME\nTRIGGER WHEN DISTANCE=0 DELAY=-10 DO STARTED ( ) PRIO=-1\nLIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0} C_DIS\n"
        "TRIGGER WHEN PATH=15.5 DELAY=0 DO PULSE ($OUT[3],TRUE,0.5)\nLIN {X 101.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\nCONTINUE\n$OUT[9] = FALSE\nEND\nDEF STARTED ( )\n$OUT[8] = TRUE\nEND\n",
    },
    "circles": {
        "ROUND1.src": "DEF ROUND1 ( )\nBAS (#INITMOV,0 )\nBAS (#FRAMES)\nPTP XHOME C_PTP\n$CIRC_TYPE = #PATH\nLIN {X 100.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 180.0}\nCIRC {X 0.0,Y 100.0,Z 0.0,A 0.0,B 0.0,C 180.0},{X -100.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 180.0},CA 360.0 C_DIS\nEND\n",
    },
    "external-axes": {
        "RAIL.src": "DEF RAIL ( )\nBAS (#INITMOV,0 )\nBAS (#BASE,2)\n$VEL_AXIS[7] = 40\nPTP {A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 0.0,A6 0.0,E1 1500.0}\nLIN {E6POS: X 10.0,Y 20.0,Z 30.0,A 0.0,B 0.0,C 0.0,S 2,T 35,E1 1550.5}\nEND\n",
    },
    "cam-post-with-long-folds": {
        "MILL_001.src": "&ACCESS RVO\n&REL 1\n&PARAM TEMPLATE = C:\\KRC\\Roboter\\Template\\ExpertVorgabe\n&PARAM EDITMASK = *\nDEF MILL_001 ( )\n;FOLD OPERATION 1\n$APO.CDIS=0.5000\n$ADVANCE=5\n$VEL.CP=0.166667\n"
        + "".join(f"LIN {{X {i * 2.5:.4f},Y {i * i * 0.01:.4f},Z -1.0000,A 0.0000,B 90.0000,C 0.0000,E1 0.0000}} C_DIS\n" for i in range(40))
        + ";ENDFOLD (OPERATION 1)\nMILL_002 ( )\nEND\n",
    },
    "ext-lines-and-cascade": {
        "TOP.src": "DEF TOP ( )\nEXT TOP_1 ( )\nEXT  BAS (BAS_COMMAND :IN,REAL :IN )\nEXTFCT REAL FAROFF (REAL :IN,INT :OUT )\nBAS (#INITMOV,0 )\n$BASE = BASE_DATA[1]\nPTP $AXIS_ACT\nTOP_1 ( )\nEND\n",
        "TOP_1.src": "DEF TOP_1 ( )\nLIN {X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0} C_DIS\nLIN {X 9.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0} C_ORI\nEND\n",
    },
    "motion-along-the-tool": {
        "DRILL.src": "DEF DRILL ( )\nDECL FRAME P\nBAS (#INITMOV,0 )\nBAS (#BASE,1)\nPTP XHOME\nP = {X 300.0,Y 0.0,Z 100.0,A 0.0,B 0.0,C 180.0}\nLIN P : {X 0.0,Y 0.0,Z -30.0,A 0.0,B 0.0,C 0.0}\nLIN P\n"
        "$BASE.Z = $BASE.Z + 0.5\nLIN {X 300.0,Y 0.0,Z (100.0 - 2.0 * 3.5),A 0.0,B 0.0,C 180.0}\nEND\n",
    },
    "config-of-a-controller": {
        "$config.dat": "&ACCESS RV2\nDEFDAT  $CONFIG\nBOOL READY=TRUE\nDECL FRAME BASE_DATA[32]\nBASE_DATA[1]={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\nBASE_DATA[2]={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\n"
        "E6AXIS XHOME={A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 0.0,A6 0.0,E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}\nDECL LOAD LOAD_DATA[16]\nLOAD_DATA[1]={M 4.5,CM {X 0.0,Y 0.0,Z 80.0,A 0.0,B 0.0,C 0.0},J {X 0.1,Y 0.1,Z 0.1}}\nENDDAT\n",
    },
    "tabs-blanks-and-comments": {
        "MESSY.SRC": "\tDEF  MESSY( )\n\n   ;nothing here\n\n\tBAS(#INITMOV,0)\n   $BASE=BASE_DATA[ 3 ]   ; the fixture\n   PTP   XHOME;home\n\tLIN{X 1,Y 2,Z 3,A 0,B 0,C 0}C_DIS;first\n   lin {x +1.5 , y -2. , z 3,a 0,b 0,c 0}\nEND;\n",
    },
    "global-subroutine-and-import": {
        "LIBA.src": "DEF LIBA ( )\nEND\nGLOBAL DEF OPEN_JAW (T1 :IN)\nREAL T1\nPULSE ($OUT[1],TRUE,T1)\nEND\n",
        "LIBB.src": "DEF LIBB ( )\nIMPORT INT PARTS IS /R1/STORE..PARTS\nOPEN_JAW (0.3)\nPARTS = PARTS + 1\nEND\n",
    },
    "operators-of-all-kinds": {
        "LOGIC.src": "DEF LOGIC ( )\nDECL BOOL Q\nDECL INT K\nDECL CHAR NAME[12]\nK = 'HFF' B_AND ('B1010' B_OR 6)\nQ = NOT (K >= 3) EXOR ((K <> 4) AND (K < 100))\nNAME[] = \"probe\"\n"
        "K = (K + 1) * -2 / 3\nSWRITE (NAME[], K, K, \"%d\", K)\nRETURN\nEND\n",
    },
    "ptp-spline": {
        "SWING.src": "DEF SWING ( )\nBAS (#INITMOV,0 )\n$BASE = BASE_DATA[1]\nPTP XHOME\nPTP_SPLINE WITH $VEL_AXIS[1] = 60\nSPTP {A1 10.0,A2 -90.0,A3 90.0,A4 0.0,A5 0.0,A6 0.0}\nSPTP {A1 20.0,A2 -80.0,A3 90.0,A4 0.0,A5 0.0,A6 0.0}\nENDSPLINE\nEND\n",
    },
}  # fmt: skip
