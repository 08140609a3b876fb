"""The list of algorithms: the 37 of Table 10 of Nazarahari 2021, with engine, quality, source and gains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from sagittal.core.estimators import PaperReference
from sagittal.core.fusion.algorithms import parameters as p

Engine = Literal["E1", "E2", "E3", "E4", "E5", "E6"]
Grade = Literal["A", "B", "C"]

ENGINES: Final[dict[Engine, str]] = {
    "E1": "complementary",
    "E2": "linear Kalman",
    "E3": "extended Kalman",
    "E4": "sigma point",
    "E5": "error state",
    "E6": "directions",
}
GRADES: Final[dict[Grade, str]] = {
    "A": "exact",
    "B": "from the paper's formulas",
    "C": "reconstruction",
}
"""A: from public code or the thesis itself; B: from the formulas of the papers, in our own reading; C: only
the structure is public."""

Magnetometer = Literal["needed", "optional", "unused"]


@dataclass(frozen=True)
class Algorithm:
    """One published algorithm.

    Parameters
    ----------
    name : identifier. label : name in the thesis. kind : variant of its engine. gains : their class. grade :
        certainty of the equations (`GRADES`). magnetometer : needed, optional or unused.
    """

    name: str
    label: str
    engine: Engine
    kind: str
    grade: Grade
    gains: type[p.AlgorithmGains]
    magnetometer: Magnetometer
    paper: PaperReference

    @property
    def shown(self) -> str:
        """Display label, which marks reconstructions."""
        return f"{self.label} (reconstruction)" if self.grade == "C" else self.label


NAZARAHARI_2021: Final = PaperReference(
    "Nazarahari M, Rouhani H 2021. Inf. Fusion 76: 8-23 (chapter 5 of Nazarahari's thesis)",
    "10.1016/j.inffus.2021.04.009",
)
MADGWICK_2011: Final = PaperReference(
    "Madgwick SOH, Harrison AJL, Vaidyanathan R 2011. IEEE ICORR: 1-7", "10.1109/ICORR.2011.5975346"
)
WU_2020: Final = PaperReference(
    "Wu J 2020. IEEE Trans. Autom. Sci. Eng. 17(4): 1777-1790", "10.1109/TASE.2020.2969574"
)

ALGORITHMS: Final = (
    Algorithm(
        "madgwick_2011", "Madgwick2011 MIMU", "E1", "gd", "A", p.MadgwickGains, "needed", MADGWICK_2011
    ),
    Algorithm(
        "madgwick_2011_imu", "Madgwick2011 IMU", "E1", "gd", "A", p.MadgwickImuGains, "unused", MADGWICK_2011
    ),
    Algorithm(
        "mahony_2008",
        "Mahony2008",
        "E1",
        "cross",
        "A",
        p.MahonyGains,
        "optional",
        PaperReference(
            "Mahony R, Hamel T, Pflimlin JM 2008. IEEE Trans. Autom. Control 53(5): 1203-1218",
            "10.1109/TAC.2008.923738",
        ),
    ),
    Algorithm(
        "hua_2014",
        "Hua2014",
        "E1",
        "hua",
        "B",
        p.HuaGains,
        "optional",
        PaperReference(
            "Hua MD, Ducard G, Hamel T, Mahony R, Rudin K 2014. IEEE Trans. Contr. Syst. Tech. 22(1): 201",
            "10.1109/TCST.2013.2251635",
        ),
    ),
    Algorithm(
        "martin_2010",
        "Martin2010",
        "E1",
        "invariant",
        "A",
        p.MartinGains,
        "needed",
        PaperReference(
            "Martin P, Salaün E 2010. Control Eng. Pract. 18(7): 712-722", "10.1016/j.conengprac.2010.01.012"
        ),
    ),
    Algorithm(
        "fourati_2011",
        "Fourati2011",
        "E1",
        "lm",
        "A",
        p.FouratiGains,
        "optional",
        PaperReference(
            "Fourati H, Manamanni N, Afilal L, Handrich Y 2011. IEEE Sens. J. 11(1): 233-244",
            "10.1109/JSEN.2010.2053353",
        ),
    ),
    Algorithm(
        "fourati_martin_2011",
        "FouratiMartin2011",
        "E1",
        "lm_c",
        "A",
        p.FouratiMartinGains,
        "needed",
        PaperReference(
            "Michel T, Genevès P, Fourati H, Layaïda N 2017. IEEE PerCom: 267-275",
            "10.1109/PERCOM.2017.7917873",
        ),
    ),
    Algorithm(
        "valenti_2015",
        "Valenti2015 AQUA",
        "E1",
        "aqua",
        "A",
        p.AquaGains,
        "optional",
        PaperReference(
            "Valenti RG, Dryanovski I, Xiao J 2015. Sensors 15(8): 19302-19330", "10.3390/s150819302"
        ),
    ),
    Algorithm(
        "del_rosario_2016",
        "DelRosario2016",
        "E1",
        "tilt_heading",
        "C",
        p.DelRosario2016Gains,
        "optional",
        PaperReference(
            "Del Rosario MB, Lovell NH, Redmond SJ 2016. IEEE Sens. J. 16(15): 6008-6017",
            "10.1109/JSEN.2016.2574124",
        ),
    ),
    Algorithm(
        "wu_2016",
        "Wu2016 FCF",
        "E1",
        "fcf",
        "B",
        p.Wu2016Gains,
        "optional",
        PaperReference(
            "Wu J, Zhou Z, Chen J, Fourati H, Li R 2016. IEEE Sens. J. 16(18): 6997-7007",
            "10.1109/JSEN.2016.2589660",
        ),
    ),
    Algorithm(
        "wu_2019",
        "Wu2019 GLeCF",
        "E1",
        "glin",
        "B",
        p.Wu2019Gains,
        "optional",
        PaperReference(
            "Wu J, Zhou Z, Fourati H, Li R, Liu M 2019. IEEE Trans. Autom. Sci. Eng. 16(3): 1330-1343",
            "10.1109/TASE.2018.2888908",
        ),
    ),
    Algorithm(
        "marantos_2016",
        "Marantos2016",
        "E1",
        "svd",
        "C",
        p.MarantosGains,
        "optional",
        PaperReference(
            "Marantos P, Koveos Y, Kyriakopoulos KJ 2016. IEEE Trans. Contr. Syst. Tech. 24(4): 1214-1226",
            "10.1109/TCST.2015.2480012",
        ),
    ),
    Algorithm(
        "justa_2020",
        "Justa2020",
        "E1",
        "justa",
        "A",
        p.JustaGains,
        "optional",
        PaperReference("Justa J, Šmídl V, Hamáček A 2020. Sensors 20(14): 3824", "10.3390/s20143824"),
    ),
    Algorithm(
        "markley_2003",
        "Markley2003",
        "E5",
        "multiplicative",
        "A",
        p.MarkleyGains,
        "optional",
        PaperReference("Markley FL 2003. J. Guid. Control Dyn. 26(2): 311-317", "10.2514/2.5048"),
    ),
    Algorithm("wu_2020_plain", "Wu2020 Plain", "E2", "gd_plain", "A", p.Wu2020PlainGains, "needed", WU_2020),
    Algorithm(
        "wu_2020_recursive",
        "Wu2020 Recursive",
        "E2",
        "gd_recursive",
        "A",
        p.Wu2020RecursiveGains,
        "needed",
        WU_2020,
    ),
    Algorithm(
        "gyrolib_2020",
        "GyroLib2020",
        "E3",
        "bias",
        "B",
        p.GyroLibGains,
        "optional",
        PaperReference("Maximov V 2020. GyroLib, AHRS library. MATLAB Central File Exchange 63250", ""),
    ),
    Algorithm(
        "ligorio_2015",
        "Ligorio2015",
        "E6",
        "two_vectors",
        "B",
        p.LigorioGains,
        "needed",
        PaperReference("Ligorio G, Sabatini AM 2015. IEEE MFI: 77-82", ""),
    ),
    Algorithm(
        "valenti_2016",
        "Valenti2016",
        "E2",
        "algebraic",
        "A",
        p.Valenti2016Gains,
        "needed",
        PaperReference(
            "Valenti RG, Dryanovski I, Xiao J 2016. IEEE Trans. Instrum. Meas. 65(2): 467-481",
            "10.1109/TIM.2015.2498998",
        ),
    ),
    Algorithm(
        "wu_2018",
        "Wu2018",
        "E2",
        "linear",
        "C",
        p.Wu2018Gains,
        "needed",
        PaperReference("Wu J, Zhou Z, Fourati H, Liu M 2018. IET Radar Sonar Navig. 12(11): 1196-1207", ""),
    ),
    Algorithm(
        "guo_2017",
        "Guo2017",
        "E2",
        "wahba",
        "A",
        p.GuoGains,
        "needed",
        PaperReference("Guo S, Wu J, Wang Z, Qian J 2017. J. Sens. 2017: 8542153", "10.1155/2017/8542153"),
    ),
    Algorithm(
        "renaudin_2014",
        "Renaudin2014",
        "E3",
        "quasi_static",
        "A",
        p.RenaudinGains,
        "optional",
        PaperReference("Renaudin V, Combettes C 2014. Sensors 14(12): 22864-22890", "10.3390/s141222864"),
    ),
    Algorithm(
        "choukroun_2006",
        "Choukroun2006",
        "E2",
        "pseudo",
        "A",
        p.ChoukrounGains,
        "optional",
        PaperReference(
            "Choukroun D, Bar-Itzhack IY, Oshman Y 2006. IEEE Trans. Aerosp. El. Syst. 42(1): 174-190",
            "10.1109/TAES.2006.1603413",
        ),
    ),
    Algorithm(
        "nazarahari_2020",
        "Nazarahari2020",
        "E2",
        "gd_disturbed",
        "A",
        p.Nazarahari2020Gains,
        "needed",
        NAZARAHARI_2021,
    ),
    Algorithm(
        "suh_2019",
        "Suh2019",
        "E5",
        "split",
        "B",
        p.Suh2019Gains,
        "optional",
        PaperReference(
            "Suh YS 2019. IEEE Trans. Aerosp. El. Syst. 55(6): 2698-2706", "10.1109/TAES.2019.2901559"
        ),
    ),
    Algorithm(
        "del_rosario_2018",
        "DelRosario2018",
        "E5",
        "windowed",
        "C",
        p.DelRosario2018Gains,
        "optional",
        PaperReference(
            "Del Rosario MB, Khamis H, Ngo P, Lovell NH, Redmond SJ 2018. IEEE Sens. J. 18(22): 9332-9342",
            "10.1109/JSEN.2018.2864989",
        ),
    ),
    Algorithm(
        "hyyti_2015",
        "Hyyti2015",
        "E6",
        "vertical",
        "A",
        p.HyytiGains,
        "unused",
        PaperReference("Hyyti H, Visala A 2015. Int. J. Navig. Obs. 2015: 503814", "10.1155/2015/503814"),
    ),
    Algorithm(
        "chen_2017",
        "Chen2017",
        "E3",
        "acceleration",
        "B",
        p.ChenGains,
        "optional",
        PaperReference("Chen H, Schall MC, Fethke N 2017. Proc. Hum. Factors Ergon. Soc. 61", ""),
    ),
    Algorithm(
        "sabatini_2006",
        "Sabatini2006",
        "E3",
        "sensor_biases",
        "A",
        p.SabatiniGains,
        "optional",
        PaperReference(
            "Sabatini AM 2006. IEEE Trans. Biomed. Eng. 53(7): 1346-1356", "10.1109/TBME.2006.875664"
        ),
    ),
    Algorithm(
        "suh_2010",
        "Suh2010",
        "E5",
        "external",
        "A",
        p.Suh2010Gains,
        "optional",
        PaperReference(
            "Suh YS 2010. IEEE Trans. Instrum. Meas. 59(12): 3296-3305", "10.1109/TIM.2010.2047157"
        ),
    ),
    Algorithm(
        "roetenberg_2005",
        "Roetenberg2005",
        "E5",
        "disturbed",
        "B",
        p.RoetenbergGains,
        "optional",
        PaperReference(
            "Roetenberg D, Luinge H, Baten C, Veltink P 2005. IEEE Trans. Neur. Syst. Rehab. 13(3): 395-405",
            "10.1109/TNSRE.2005.847353",
        ),
    ),
    Algorithm(
        "nazarahari_2021",
        "Nazarahari2021 REKF",
        "E3",
        "full",
        "A",
        p.Nazarahari2021Gains,
        "optional",
        NAZARAHARI_2021,
    ),
    Algorithm(
        "srckf",
        "SRCKF",
        "E4",
        "cubature",
        "A",
        p.CubatureGains,
        "optional",
        PaperReference(
            "Arasaratnam I, Haykin S 2009. IEEE Trans. Autom. Control 54(6): 1254-1269",
            "10.1109/TAC.2009.2019800",
        ),
    ),
    Algorithm(
        "srukf1",
        "SRUKF1",
        "E4",
        "merwe",
        "A",
        p.MerweGains,
        "optional",
        PaperReference("van der Merwe R, Wan EA 2001. IEEE ICASSP: 3461-3464", "10.1109/ICASSP.2001.940586"),
    ),
    Algorithm(
        "srukf2",
        "SRUKF2",
        "E4",
        "julier95",
        "A",
        p.JulierGains,
        "optional",
        PaperReference(
            "Julier SJ, Uhlmann JK, Durrant-Whyte HF 1995. American Control Conference: 1628-1632",
            "10.1109/ACC.1995.529783",
        ),
    ),
    Algorithm(
        "srukf3",
        "SRUKF3",
        "E4",
        "spherical_simplex",
        "A",
        p.SimplexGains,
        "optional",
        PaperReference("Julier SJ 2003. American Control Conference: 2430-2434", "10.1109/ACC.2003.1243439"),
    ),
    Algorithm(
        "srukf4",
        "SRUKF4",
        "E4",
        "menegaz",
        "A",
        p.MenegazGains,
        "optional",
        PaperReference("Menegaz HM, Ishihara JY, Borges GA 2011. IEEE CDC: 3172-3177", ""),
    ),
)
"""In the order of the page docs/science/filters.md. An empty DOI: we found none."""

BY_NAME: Final[dict[str, Algorithm]] = {a.name: a for a in ALGORITHMS}
